(function(){
var tip=document.getElementById('tip');
document.querySelectorAll('svg.wfl title').forEach(function(t){
var e=t.parentNode;e.dataset.note=t.textContent;e.setAttribute('aria-label',t.textContent);t.remove();});
function show(v){
var e=v.target.closest?v.target.closest('[data-note]'):null;
if(!e){tip.style.display='none';return;}
tip.textContent=e.dataset.note;tip.style.display='block';
var w=tip.offsetWidth,h=tip.offsetHeight,x=v.clientX+14,y=v.clientY+14;
if(x+w>innerWidth-6)x=Math.max(6,v.clientX-w-14);
if(y+h>innerHeight-6)y=Math.max(6,v.clientY-h-14);
tip.style.left=x+'px';tip.style.top=y+'px';}
document.addEventListener('pointermove',show);
document.addEventListener('pointerdown',show);
document.addEventListener('scroll',function(){tip.style.display='none';},true);
})();
